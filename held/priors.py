from pool import *
lam=[1,3,10]
def ahead(t,Y,dt):
    if dt==0: return Y
    out=np.full_like(Y,np.nan); j=np.searchsorted(t,t+dt-40)
    ok=(j<len(t)); jj=np.minimum(j,len(t)-1); ok&=np.abs(t[jj]-(t+dt))<40
    out[ok]=Y[jj[ok]]; return out
def em(G,g,yy,n,mu,C,nv,eff,it=60,shr=0.0):
    p=len(mu); M=len(G); nvs=np.array(nv)
    for _ in range(it):
        Ci=np.linalg.inv(C); T=[];V=np.zeros((p,p))
        for m in range(M):
            H=np.linalg.inv(G[m]/(nvs[m]*eff)+Ci); th=H@(g[m]/(nvs[m]*eff)+Ci@mu); T.append(th); V+=H
        T=np.array(T); mu=T.mean(0); D=T-mu; C=(D.T@D+V)/M; C=(1-shr)*C+shr*np.trace(C)/p*np.eye(p)
        C=(C+C.T)/2
    return mu,C
for dt in (300,0):
    res={}
    for ai,a in enumerate(AX):
        Z=[];nv=[];G=[];g=[];n=[]
        for m in TR:
            t,X,Y=train[m]; y=ahead(t,Y,dt)[:,ai]; k=np.abs(y)<LIM
            A=design(X[k]); yk=y[k]
            i,b=ridge(X[k],yk,1.0,s); th=np.r_[i+c@b,b*s]; Z.append(th); nv.append(np.mean((yk-A@th)**2))
            G.append(A.T@A); g.append(A.T@yk); n.append(k.sum())
        Z=np.array(Z); mu,C,r=lw(Z); nvm=np.mean(nv)
        D=Z-mu; S=D.T@D/29; dg=np.diag(S)
        pri={'lw':(mu,C),'diag':(mu,.3*np.diag(dg)+.7*S)}
        pri={}
        for M in (5,8,12,30):
            L=lw(Z[:M]); 
            pri['lw-%d'%M]=L[:2]
            for f in (0,.1,.3): pri['em-%d-%g'%(M,f)]=em(G[:M],g[:M],None,n,*L[:2],nv[:M],1,3,L[2]*f)
        for m in TE:
            t,X,Y=own[m]; y=ahead(t,Y,dt)[:,ai]; k=np.abs(y)<LIM
            tl,Xl,Yl=later[m]; yl=ahead(tl,Yl,dt)[:,ai]; f=np.isfinite(yl); tl=tl[f];Xl=Xl[f];yl=yl[f]; st=step(tl)
            R=lambda e:(rms(e,~st),rms(e,st),rms(e,st|~st))
            i,b=ridge(X[k],y[k],1.0); e=yl-i-Xl@b
            res['week',a,m]=R(e)
            Dl=design(Xl)
            for h in (1,3):
                q=k&(t>=h*3600+1343)&(t+dt<(h+2)*3600); A=design(X[q]); Y2=y[q]
                i,b=ridge(X[q],Y2,1.0); res['without',h,a,m]=R(yl-i-Xl@b)
                for w,(mu_,C_) in pri.items():
                    Ci=np.linalg.inv(C_)
                    res['mean '+w,h,a,m]=R(yl-Dl@mu_)
                    for l in lam:
                        th=mu_+np.linalg.solve(A.T@A+l*nvm*Ci,A.T@(Y2-A@mu_)); res[w+' %g'%l,h,a,m]=R(yl-Dl@th)
    keys=[]; [keys.append(k[0]) for k in res if len(k)==4 and k[0] not in keys]
    for h in (1,3):
        for w in keys:
            L=np.log([np.array(res[w,h,a,m])/np.array(res['week',a,m]) for a in AX for m in TE])
            print(dt,h,w,np.exp(L.mean(0)).round(3),flush=True)
